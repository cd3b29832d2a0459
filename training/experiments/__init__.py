"""The paper's experiments: tables of detectors trained on one kind of frames and tested on another."""

from training.experiments.table import ExperimentTable, load_table, table_names

__all__ = ["ExperimentTable", "load_table", "table_names"]

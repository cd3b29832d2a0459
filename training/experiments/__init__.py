"""The paper's experiments: tables of detectors trained and tested on different sets of frames."""

from training.experiments.table import ExperimentTable, load_table, table_names

__all__ = ["ExperimentTable", "load_table", "table_names"]

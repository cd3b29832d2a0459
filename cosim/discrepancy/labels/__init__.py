"""Label bias: are labelled boxes smaller than the bodies in them, and by what law."""

from cosim.discrepancy.labels.diagnose import LabelFinding, diagnose_labels
from cosim.discrepancy.labels.hook import with_labels

__all__ = ["LabelFinding", "diagnose_labels", "with_labels"]

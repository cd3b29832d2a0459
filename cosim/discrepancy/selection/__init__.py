"""Choice of hypotheses: scores by cluster, gains by cross-fitting, p-values by sign flips, exact refits."""

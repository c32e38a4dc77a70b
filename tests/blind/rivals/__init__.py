"""What others would do with the same residuals: term selection by PySINDy, BIC and LASSO."""

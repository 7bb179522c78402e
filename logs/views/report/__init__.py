"""The report and the comparison as pages of their own."""

"""Will this plan really fly?  The application: commands and the plan-then-fly pipeline."""

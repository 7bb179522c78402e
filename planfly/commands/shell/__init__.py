"""Commands on planfly itself: its help, and what a shell completes."""

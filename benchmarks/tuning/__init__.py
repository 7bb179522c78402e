"""Settings of guidance laws, found by flights."""

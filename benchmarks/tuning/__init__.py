"""Settings of guidance laws, looked for by flights."""

"""Find remedies for surveys, and describe surveys in text."""

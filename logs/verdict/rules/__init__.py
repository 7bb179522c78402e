"""The rules, one topic a file: what each asks, and the findings it makes."""

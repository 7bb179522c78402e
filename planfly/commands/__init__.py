"""Commands of planfly: one module for each, with a function of the same name, which `registry` finds."""

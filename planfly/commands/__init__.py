"""Commands of planfly, one module each, with a function of the same name that `registry` finds."""

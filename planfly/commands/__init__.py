"""Commands of planfly, one module each, whose functions `registry` lists."""

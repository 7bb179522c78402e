"""Commands of planfly, one module each, whose functions `planfly.cli` lists."""

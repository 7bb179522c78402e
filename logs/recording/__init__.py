"""Write, read and recover flights as MCAP files."""

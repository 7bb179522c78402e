"""Flight logs as columns of numbers: CSV, MAT, Parquet and HDF5 files, read by a table of columns."""

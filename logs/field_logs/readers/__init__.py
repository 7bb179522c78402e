"""Readers of logs, one a format: bytes in, `logs.field_logs.raw_log.RawLog` out."""

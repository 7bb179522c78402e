"""After the fact: recorder, reader, replay, check (the verdict), report and figures."""

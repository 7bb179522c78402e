"""What is recorded for viewers alone: the aircraft's model, the track so far, points, and what happened when."""

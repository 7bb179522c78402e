"""What figures share: style, panels, labels, legends, and how threats, ground and failures are drawn."""

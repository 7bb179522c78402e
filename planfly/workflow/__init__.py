"""Steps of every command: open a mission, set up its flight, plan, fly, judge and write the results."""

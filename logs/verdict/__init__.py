"""The verdict: findings of each rule, from only the mission and from the flown track."""

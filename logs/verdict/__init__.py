"""The verdict: findings of each rule, from the mission alone and from the flown track."""

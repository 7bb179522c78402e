"""Answers about surveys: remedies and text."""

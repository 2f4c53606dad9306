"""Analyses: settlement, pushover and limit load."""

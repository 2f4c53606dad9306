"""Runs: a case solved from its file to its results folder."""

"""The results folder: written as a run goes, reopened without solving."""

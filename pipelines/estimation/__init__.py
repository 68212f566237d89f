"""Estimate models of an arm from logs, and check the logs first."""

"""Two results folders side by side: before and after strengthening, with one friction and with another."""

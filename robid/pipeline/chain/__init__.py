"""The stages as values: what each reads, writes and says. What one does is imported from its namesake when it runs."""

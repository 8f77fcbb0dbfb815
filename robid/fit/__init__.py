"""Fits. What every fit returns is in `estimate`; then a package for each family, and what they share."""

"""Figures and the page: plain values in, one offline HTML file or terminal tables out."""

"""The Staubli TX40 of a public recording. Read `published`, then `page`."""

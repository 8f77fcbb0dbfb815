"""What a robot file may have wrong, and what that does to a response.

Read `column`, which says what a doubt is, then `scene`, the fitted robot that can be changed, then `listing` and
`columns`; the other modules hold one kind of doubt each.
"""

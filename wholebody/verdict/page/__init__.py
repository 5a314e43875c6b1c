"""A verdict as a page: the robot in motion, every margin with its bound, causes in words, in one file.

Begin with `wholebody.verdict.page.page.write_page`.
"""

"""Many inputs judged: on all cores, resumed after a kill, answers as tables, lists and a ranked page.

Begin with `wholebody.verdict.audit.audit.audit`.
"""

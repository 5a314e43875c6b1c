"""Verdicts on chunks and arrays that a program hands in: judged, repaired, or ranked.

Begin with `wholebody.verdict.given.own_numbers.judge`, and `wholebody.verdict.given.many.judge_many`.
"""

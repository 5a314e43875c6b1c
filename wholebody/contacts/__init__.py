"""Contacts: what holds the robot up, and the forces that it can give.

Begin with `wholebody.contacts.foot.FootContact`.
"""

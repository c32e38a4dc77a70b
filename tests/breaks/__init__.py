"""Deliberate breaks of the code: how many of them do the tests find?"""

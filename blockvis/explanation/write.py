def refuse_explanation(*a):
    pass


def write_explanation(*a, **k):
    pass

"""One tick: state and reference in, joint command out.

Begin with `wholebody.control.controller.WholeBodyController`; the program is that of `wholebody.qp`.
"""

"""Policies: `learning` of forward models, `choosing` of actions, `evaluating` of what came."""

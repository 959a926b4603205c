"""The hidden-effect benchmark: draw what is hidden, measure it, seal the answer, score.

The drawing side knows the virtual rig's hidden effects and knows nothing of robotcast.effects
and robotcast.diagnosis; the scoring side reads answers and the diagnoses' JSON files alone.
"""

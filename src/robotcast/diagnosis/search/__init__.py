"""Which effect a model lacks: screened, refitted, judged on trials held out."""

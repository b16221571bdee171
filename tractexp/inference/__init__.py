"""What free numbers do to residuals: fits, noise, chance, intervals. It knows no verdicts and no
pages.
"""

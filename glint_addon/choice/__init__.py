"""Which lights a material looks for: which its facets can mirror, which would be noisy without, which are near."""

"""The result of a diagnosis and its words.

words           words that the summary and the report share
judgeable       the verdict "cannot-judge", and checks of the nominal model
without_limit   causes that have neither a finding nor a detection limit
outcome         what the stages `diagnose` and `extend` return
"""

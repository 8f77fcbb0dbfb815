"""The stages. Read `stage`, then `chain/`: what each reads, writes and says; what it does is in its namesake here."""

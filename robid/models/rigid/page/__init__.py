"""What of a rigid fit stands on its page: read `content`, `motors`, `torques`, `friction`, then `report`."""

"""Where the standing robot can hold its palms: a fitted map of what the search for still postures finds.

Begin with `wholebody.planning.reachability.reach_map.ReachabilityMap`.
"""

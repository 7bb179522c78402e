"""Ten lines: plan across real ridges, fly it in 8 m/s of wind, look at the verdict, draw it, export it, report it."""

import planfly

path = planfly.plan("jacksboro", seed=1)
flown = planfly.fly(path, wind=(8, 270), turbulence="light", log="flight.mcap")
print(flown.verdict.headline)
for finding in flown.verdict.failed:
    print(finding.rule, finding.place.kind, finding.place.index, finding.reason)
planfly.figures(flown)["map"].savefig("map.png")
planfly.export(path, "mission.waypoints", "mission.kml")
flown.track.to_csv("track.csv")
print(planfly.report(flown, "report").page)

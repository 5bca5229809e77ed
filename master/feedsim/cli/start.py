"""What `feedsim` alone says: the four things a person may want, with the command for each."""

START_TEXT = """feedsim simulates the feed drives of a machine tool: control, friction and structure.

See it work
  feedsim example xz_circle z_positioning      copies two scenarios into this folder
  feedsim run xz_circle.yaml                   a circle, why it is not round, and a report

Find out why a measured circle is not round
  feedsim circle ballbar.csv --axes X,Y --radius "150 mm" --feed "1000 mm/min"

Rebuild a machine from its records
  feedsim identify drive capture.json --axes X,Y --out results/my_machine
  feedsim replay capture.json --machine results/my_machine

Try a change before it is made
  feedsim run xz_circle.yaml --set machine.axes.X.drive.K_v="5 (m/min)/mm" --out results/faster
  feedsim diff results/xz_circle results/faster

feedsim --help lists all commands, feedsim COMMAND --help the options of one; feedsim docs opens the tutorials.
"""

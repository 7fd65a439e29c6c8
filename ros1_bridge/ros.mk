# The bridge's own targets, included by the Makefile.

.PHONY: description check-description mrl-msgs pictures test-navigation
description: ## Render the robots' URDF files, and launch files' arguments from the node's parameters
	$(PY) -m ros1_bridge.description

check-description: ## Check that the files of `make description` are current
	$(PY) -m ros1_bridge.description --check

mrl-msgs: ## Write the catkin package mrl_msgs, with typed messages, into the workspace folder DIR=~/catkin_ws/src
	@/usr/bin/python3 -m ros1_bridge.topics.typed_messages '$(DIR)'

PICTURES ?= $(if $(FAST),build/smoke,.)
pictures: setup firmware ## Take the pictures of the live view, of rviz and of the page for the documents, without a display
	@mkdir -p $(PICTURES)/ros1_bridge $(PICTURES)/docs
	$(PY) -m tests.documents.live_view_picture $(PICTURES)/ros1_bridge/live_view.svg
	$(PY) -m tests.documents.page_picture $(PICTURES)/docs/page_phone.png $(PICTURES)/docs/page_desk.png
	$(ROS_ENV) $(PY) -m tests.documents.rviz_picture $(PICTURES)/ros1_bridge/rviz.png
	$(if $(FAST),,$(ROS_ENV) $(PY) -m tests.documents.rviz_picture $(PICTURES)/ros1_bridge/rviz_team.png team)
	$(if $(FAST),,$(ROS_ENV) $(PY) -m tests.documents.rviz_picture $(PICTURES)/ros1_bridge/rviz_environment.png environment)
	$(if $(NAVIGATION_SETUP),$(ROS_ENV) source '$(NAVIGATION_SETUP)' && \
	  $(PY) -m tests.documents.rviz_picture $(PICTURES)/ros1_bridge/rviz_navigation.png navigation)

test-navigation: setup ## Ten goals a run with the real move_base, installed or in the workspace of NAVIGATION_SETUP=path/setup.bash; build/navigation/table.json
	@$(ROS_ENV) $(if $(NAVIGATION_SETUP),source '$(NAVIGATION_SETUP)' &&) $(PY) -m tests.long.navigation && \
	  $(PY) -m tests.long.navigation.stops && $(PY) -m tests.long.navigation.ekf && $(PY) -m tests.long.navigation.slam

# Run the unit tests (test_*.py) of a folder or a file with pytest, as part of
# run_tests. catkin itself knows nose only. Hypothesis is told not to mind how slow
# a machine is, and to try the same examples every time.
#
# :param path: folder or file, relative to the package
function(crazyflie_add_pytest path)
  string(REPLACE "/" "_" name "${path}")
  set(report "${CATKIN_TEST_RESULTS_DIR}/${PROJECT_NAME}/pytest-${name}.xml")
  catkin_run_tests_target("pytest" "${name}" "pytest-${name}.xml"
    COMMAND "${PYTHON_EXECUTABLE} -m pytest ${CMAKE_CURRENT_SOURCE_DIR}/${path} -q -p no:cacheprovider -p crazyflie_utils.testing.pytest_plugin --junit-xml=${report}")
endfunction()

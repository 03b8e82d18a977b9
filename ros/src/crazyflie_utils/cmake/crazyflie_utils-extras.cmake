# Make a program of this package that calls what is named as package.module:name, and install it.
#
# :param name: file name of the program
# :param callable: the function, for crazyflie_utils.run_program
# :param NODE: name of the node, unless the launch file gives another; the callable is its class
# :param NODES: the same for a process whose nodes the function returns, see crazyflie_utils.run_nodes
# :param DESTINATION: in the place of CATKIN_PACKAGE_BIN_DESTINATION
function(crazyflie_add_program name callable)
  cmake_parse_arguments(program "" "NODE;NODES;DESTINATION" "" ${ARGN})
  if(program_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "crazyflie_add_program(${name}): ${program_UNPARSED_ARGUMENTS} has no meaning")
  endif()
  if(program_NODE)
    set(call "run(\"${callable}\", \"${program_NODE}\")")
  elseif(program_NODES)
    set(call "run_nodes(\"${program_NODES}\", \"${callable}\")")
  else()
    set(call "run_program(\"${callable}\")")
  endif()
  string(REGEX MATCH "^[a-z_]+" function "${call}")
  set(code "from crazyflie_utils import ${function}\n\n${call}\n")
  set(destination ${CATKIN_PACKAGE_BIN_DESTINATION})
  if(program_DESTINATION)
    set(destination ${program_DESTINATION})
  endif()
  # The interpreters are those of catkin_install_python.
  set(in_devel "${CATKIN_DEVEL_PREFIX}/${destination}/${name}")
  file(CONFIGURE OUTPUT "${in_devel}" CONTENT "#!${PYTHON_EXECUTABLE}\n${code}" @ONLY)
  file(CHMOD "${in_devel}" PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE
    GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
  get_filename_component(python "${PYTHON_EXECUTABLE}" NAME)
  set(installed "${CMAKE_CURRENT_BINARY_DIR}/catkin_generated/installspace/${name}")
  file(CONFIGURE OUTPUT "${installed}" CONTENT "#!/usr/bin/env ${python}\n${code}" @ONLY)
  install(PROGRAMS "${installed}" DESTINATION ${destination})
endfunction()

# Run the unit tests (test_*.py) of a folder or a file with pytest, as part of
# run_tests. catkin itself knows nose only.
#
# :param path: folder or file, relative to the package
# :param APART: files of this folder that are tests of their own, which may run in parallel with it
# :param WORKERS: number of processes that share the files, if their tests mostly wait
# :param CALCULATES: they hardly wait; they begin early, and leave the processors to whoever flies
#     against the clock in parallel with them
function(crazyflie_add_pytest path)
  cmake_parse_arguments(pytest "CALCULATES" "WORKERS" "APART" ${ARGN})
  string(REPLACE "/" "_" name "${path}")
  set(report "${CATKIN_TEST_RESULTS_DIR}/${PROJECT_NAME}/pytest-${name}.xml")
  # The plugin of anyio, which the dashboard brings, costs each program 0.1 s.
  set(command "${PYTHON_EXECUTABLE} -m pytest ${CMAKE_CURRENT_SOURCE_DIR}/${path} -q -p no:cacheprovider -p no:anyio -p crazyflie_utils.testing.pytest_plugin --junit-xml=${report}")
  if(pytest_CALCULATES)
    string(PREPEND command "nice -n 10 ")
  endif()
  if(pytest_WORKERS)
    string(APPEND command " -n ${pytest_WORKERS} --dist loadfile")
  endif()
  foreach(file ${pytest_APART})
    string(APPEND command " --ignore=${CMAKE_CURRENT_SOURCE_DIR}/${path}/${file}")
    crazyflie_add_pytest(${path}/${file})
  endforeach()
  catkin_run_tests_target("pytest" "${name}" "pytest-${name}.xml" COMMAND "${command}")
  if(pytest_WORKERS)
    # Tests that mostly wait begin first, in parallel with those that need the processors most.
    math(EXPR cost "2000 + ${pytest_WORKERS}")
    _crazyflie_set_tests_properties("pytest_${name}$" COST ${cost})
  endif()
  if(pytest_CALCULATES)
    _crazyflie_set_tests_properties("pytest_${name}$" COST 2400)
  endif()
endfunction()

# Say how many halves of a processor tests of this package need: 2 if they fly in several processes
# against the clock, 3 or 4 if in many. Others count as one half, whether they compute or wait.
# ``ctest -j`` then runs fewer in parallel. It begins with them: it would start others of one half
# whenever one half is free, and come to them at the end, when nothing else is left.
#
# :param halves: of a processor
# :param ARGN: what the names of the tests match, regular expressions
function(crazyflie_busy_tests halves)
  _crazyflie_set_tests_properties("${ARGN}" PROCESSORS ${halves} COST ${halves}500)
endfunction()

# Declare that tests of this package measure quantities that parallel tests would change.
#
# :param ARGN: what the names of the tests match, regular expressions
function(crazyflie_lonely_tests)
  _crazyflie_set_tests_properties("${ARGN}" RUN_SERIAL TRUE COST 9000)
endfunction()

# Say that tests of this package take long: ``./run tests`` leaves them out, ``./run tests --all``
# and ``catkin_make run_tests`` run them. Single unit tests are marked ``@pytest.mark.long``.
#
# :param ARGN: what the names of the tests match, regular expressions
function(crazyflie_long_tests)
  _crazyflie_set_tests_properties("${ARGN}" LABELS long)
endfunction()

function(_crazyflie_set_tests_properties patterns)
  get_property(tests DIRECTORY PROPERTY TESTS)
  foreach(pattern ${patterns})
    set(matching ${tests})
    list(FILTER matching INCLUDE REGEX "${pattern}")
    if(NOT matching)
      message(FATAL_ERROR "${PROJECT_NAME} has no test that matches ${pattern}")
    endif()
    set_tests_properties(${matching} PROPERTIES ${ARGN})
  endforeach()
endfunction()

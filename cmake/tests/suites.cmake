# Read by ctest when it starts, with `executables`, their `labels` and a `timeout`: one test for each suite of GoogleTest.
# What the tests of a suite share (rendered images, a simulated log) is made once, and a fifth of a second of loading
# saved for each of them. Those with parameters are the long ones: one test each, and first, as alone at the end they
# would leave cores idle.
set(waiting_suites "^(HeadCommand|Heads)$") # for devices that take their time: they begin first, and the others work beside them
# Ten seconds of a processor and more: begun late, one of them would be alone at the end.
set(long_suites "^(ServoCauses|IdentifyClusters|Localize|LoopClosure|SensorScale|LocalizeImu|SimpleCase|LensKind|LongWalk|DepthScale|SensorFaults|LocalizeImages|LocalizeImageFolders|Live|MovingTarget|MovingTargetCommand|TrackFaults|ConsideredErrors|ObserveCauses|ObserveSigma|ObserveDegenerate|ObservePhotos|ZoomingLog|RigTable|Rig|Turned|RenderedWalk|HeadCalibrate|RangefinderCommand)$")
set(none_ran "Running 0 tests from") # a filter that no test passes is no success
foreach(executable label IN ZIP_LISTS executables labels)
  get_filename_component(name ${executable} NAME)
  if(NOT EXISTS ${executable})
    add_test(${name}_NOT_BUILT ${executable})
    continue()
  endif()
  execute_process(COMMAND ${executable} --gtest_list_tests OUTPUT_VARIABLE listed RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "${executable} --gtest_list_tests: ${failed}")
  endif()
  string(REPLACE "\n" ";" lines "${listed}")
  set(suite "")
  set(count 0)
  foreach(line IN LISTS lines ITEMS "end.")
    if(line MATCHES "^  ([^ ]+)")
      set(one ${CMAKE_MATCH_1}) # the next MATCHES forgets it
      math(EXPR count "${count} + 1")
      if(suite MATCHES "/")
        add_test(${label}.${suite}.${one} ${executable} "--gtest_filter=${suite}.${one}")
        set_tests_properties(${label}.${suite}.${one} PROPERTIES LABELS ${label} TIMEOUT ${timeout} COST 100
                             FAIL_REGULAR_EXPRESSION "${none_ran}")
      endif()
    elseif(line MATCHES "^([^ ]+)\\.( |$)")
      set(next ${CMAKE_MATCH_1})
      if(count GREATER 0 AND NOT suite MATCHES "/")
        set(cost ${count})
        if(suite MATCHES "${waiting_suites}")
          set(cost 900)
        elseif(suite MATCHES "${long_suites}")
          set(cost 500)
        endif()
        add_test(${label}.${suite} ${executable} "--gtest_filter=${suite}.*")
        set_tests_properties(${label}.${suite} PROPERTIES LABELS ${label} TIMEOUT ${timeout} COST ${cost}
                             FAIL_REGULAR_EXPRESSION "${none_ran}")
        if(suite STREQUAL Speed)  # measures time: alone, when the others are done
          set_tests_properties(${label}.${suite} PROPERTIES RUN_SERIAL TRUE)
        endif()
        list(APPEND tests_of_${label} ${label}.${suite})
      endif()
      set(suite ${next})
      set(count 0)
    endif()
  endforeach()
endforeach()

# The results that tests of commands left, against their schema.
add_test(schema ${schema_test})
set_tests_properties(schema PROPERTIES LABELS cli TIMEOUT ${timeout} COST 0 SKIP_RETURN_CODE 77 DEPENDS "${tests_of_cli}")

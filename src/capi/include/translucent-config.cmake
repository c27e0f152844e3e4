# find_package(translucent) gives the targets translucent::translucent (shared) and translucent::static. Both need
# Vulkan's headers.
get_filename_component(_translucent_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
set(_translucent_lib "${_translucent_prefix}/lib")
if(NOT TARGET translucent::translucent)
  find_package(Threads REQUIRED)
  add_library(translucent::translucent SHARED IMPORTED)
  set_target_properties(translucent::translucent PROPERTIES
    IMPORTED_LOCATION "${_translucent_lib}/${CMAKE_SHARED_LIBRARY_PREFIX}translucent${CMAKE_SHARED_LIBRARY_SUFFIX}"
    IMPORTED_NO_SONAME TRUE
    INTERFACE_INCLUDE_DIRECTORIES "${_translucent_prefix}/include")
  add_library(translucent::static STATIC IMPORTED)
  set_target_properties(translucent::static PROPERTIES
    IMPORTED_LOCATION "${_translucent_lib}/${CMAKE_STATIC_LIBRARY_PREFIX}translucent${CMAKE_STATIC_LIBRARY_SUFFIX}"
    INTERFACE_LINK_LIBRARIES "Threads::Threads;${CMAKE_DL_LIBS};m"
    INTERFACE_INCLUDE_DIRECTORIES "${_translucent_prefix}/include")
endif()
unset(_translucent_lib)
unset(_translucent_prefix)

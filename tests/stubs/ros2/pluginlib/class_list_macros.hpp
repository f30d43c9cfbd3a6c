// Makes an exported class by a C function, as a plugin loader would.
#pragma once
#define PLUGINLIB_EXPORT_CLASS(Class, Base) \
  extern "C" Base * make_plugin() {return new Class();}

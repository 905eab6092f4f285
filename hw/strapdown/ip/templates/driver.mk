# Compiles the driver of {{ name }} into the library of a board support package.
COMPILER =
ARCHIVER =
CP = cp
COMPILER_FLAGS =
EXTRA_COMPILER_FLAGS =
LIB = libxil.a
RELEASEDIR = ../../../lib
INCLUDEDIR = ../../../include
INCLUDES = -I./. -I$(INCLUDEDIR)
SOURCES = {{ c_files | join(' ') }}
HEADERS = {{ headers | join(' ') }}

.PHONY: libs include clean

libs: $(SOURCES)
	$(COMPILER) $(COMPILER_FLAGS) $(EXTRA_COMPILER_FLAGS) $(INCLUDES) -c $(SOURCES)
	$(ARCHIVER) -r $(RELEASEDIR)/$(LIB) $(SOURCES:.c=.o)
	rm -f $(SOURCES:.c=.o)

include: $(HEADERS)
	$(CP) $(HEADERS) $(INCLUDEDIR)

clean:
	rm -f $(SOURCES:.c=.o)
